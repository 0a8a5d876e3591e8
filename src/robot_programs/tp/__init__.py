"""TP: programs of FANUC's robots, in the text form of their listings."""
