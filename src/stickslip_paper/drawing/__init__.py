"""What the figures of [M] share."""
