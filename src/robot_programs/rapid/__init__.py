"""ABB RAPID: modules to motions and back."""
