"""Claim by claim what came out: pages whose numbers are read from the published tables when they are written."""
