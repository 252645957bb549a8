"""What a map is: measures, over which parameters, in which chunks. Computes nothing, touches no disk."""
