"""KUKA programs in KRL: ``.src`` with their data lists ``.dat``."""
