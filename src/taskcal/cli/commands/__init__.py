"""The commands, each in the file of its name: it reads, makes one call and writes."""
