"""Run folders, caches, figures, reports; computes nothing."""
