"""URScript: programs of Universal Robots, ``.script`` files and what PolyScope makes of a ``.urp``."""
