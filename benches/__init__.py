"""Speed of truearm beside its peers, measured in the same run: python -m benches."""
