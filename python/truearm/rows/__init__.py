"""Which rows belong together: visits, shots, distances, and the parts that data is split into."""
