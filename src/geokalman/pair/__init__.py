"""Two satellites one behind the other: the small problem on which the Foundations teach."""
