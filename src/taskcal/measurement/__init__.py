"""Campaigns: reading them, tracker noise, registration without starting values, and the virtual cell."""
