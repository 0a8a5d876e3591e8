"""What both libraries stand on: errors, files, rigid transforms, registries, texts with their values, descriptions of options."""
