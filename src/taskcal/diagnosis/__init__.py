"""What is wrong with a campaign: the usual mistakes, each undone and tried on held-out rows."""
