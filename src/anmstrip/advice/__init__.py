"""What is said of a scene before it runs, and of a run that stops."""
