"""What all languages share: the text of a program, its motions, and the table of languages."""
