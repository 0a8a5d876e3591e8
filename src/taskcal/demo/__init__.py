"""The demonstration: a published procedure and a closed loop, on a virtual robot. A guest: nothing below it knows it."""
