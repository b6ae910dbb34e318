"""Pages with stored motions, which need neither this program nor a network: one file each."""
