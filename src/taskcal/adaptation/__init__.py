"""The model adapted to the task: expected task error, the choice of parameters and of measuring poses, studies."""
