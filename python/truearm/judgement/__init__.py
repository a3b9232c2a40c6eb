"""Errors on rows that took no part in a fit."""
