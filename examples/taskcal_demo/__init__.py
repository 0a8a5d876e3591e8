"""The demonstration: a published procedure and a closed loop, on a virtual robot. A guest: no library knows it."""
