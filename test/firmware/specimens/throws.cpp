// Must not compile: firmware has no exceptions.
int checked(int value) {
  if (value < 0) throw value;
  return value;
}
