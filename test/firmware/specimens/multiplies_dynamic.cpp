// Must be turned away by the symbol gate: a product with a dynamic matrix takes memory from the heap.
#include <Eigen/Core>

void multiply(const Eigen::MatrixXd& a, const Eigen::VectorXd& x, Eigen::VectorXd& y) { y = a * x; }
