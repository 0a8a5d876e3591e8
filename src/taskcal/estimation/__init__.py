"""Priors, losses, least squares on normal equations, marginal likelihood, information. Numbers only."""
