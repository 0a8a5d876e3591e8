"""What a fit of the geometry is looked at for before it is believed, of robot file, rows, their course and their digits."""
