/// @file
/// What the polynomials of Savitzky and Golay may be.
#pragma once

namespace heft::data {

/// @throws DataError when the order is not `least` to 8
void check_order(int order, int least);

}  // namespace heft::data
