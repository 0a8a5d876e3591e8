"""Figures, tables and reports: data in, pictures and pages out; nothing is computed here that a number depends on."""
