"""Connections to controllers and instruments, each by its maker's own protocol; `taskcal.live.devices` says what one is."""
