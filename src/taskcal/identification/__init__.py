"""From a campaign to a Calibration: the fit, its covariance, its residuals, and held-out validation."""
