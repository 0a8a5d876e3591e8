"""What the parameters do to the tool, which of them the poses can tell apart, and how well."""
