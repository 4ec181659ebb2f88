// Must be turned away by the symbol gate: stdio.
#include <cstdio>

void print_torque(double torque) { std::printf("%f\n", torque); }
