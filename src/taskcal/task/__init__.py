"""What the robot has to do: a workspace, a list of poses or a tool path, and the accuracy it needs."""
