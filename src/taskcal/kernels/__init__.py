"""Compiled passes over many poses: the walk along a chain, the closure of a four-bar, normal equations, covariances."""
