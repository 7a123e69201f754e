"""The judge of whole-arm contact estimation: scenes, how they are played, how they are scored."""
