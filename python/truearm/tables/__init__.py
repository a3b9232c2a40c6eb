"""What people write into tables, and how it is read."""
