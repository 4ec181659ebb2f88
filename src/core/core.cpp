// Explicit instantiations follow.
