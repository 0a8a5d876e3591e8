"""Robots: their description and catalogue, the joint side, the error model, the mechanism's mobility."""
