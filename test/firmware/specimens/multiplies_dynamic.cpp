// Must be turned away by the symbol gate: a product of dynamic matrices takes memory from the heap.
#include <Eigen/Core>

void multiply(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b, Eigen::MatrixXd& c) { c = a * b; }
