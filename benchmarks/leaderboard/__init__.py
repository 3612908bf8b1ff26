"""The leaderboard: rows of measured numbers, each beside the evidence that it follows from."""
