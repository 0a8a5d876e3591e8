"""The model adapted to the task: a publication's procedure, expected task error, the choice of parameters."""
