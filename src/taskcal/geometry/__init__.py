"""Rigid transforms, the compiled walk along a chain, and the four-bar closure. Numbers only: knows no robot."""
