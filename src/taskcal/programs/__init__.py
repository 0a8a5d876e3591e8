"""Robot programs: RAPID, KRL, APT and CSV, from text to motions and back."""
