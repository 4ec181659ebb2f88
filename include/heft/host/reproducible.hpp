/// @file
/// The same results on every processor.
#pragma once

namespace heft::host {

/// Takes from Eigen the choice of the blocks in which it multiplies matrices, which it makes by the caches of the processor
/// it runs on: sums in another order differ in the last digit, of which an optimiser can make more. A program calls it
/// first; on one thread.
void multiply_alike_everywhere();

}  // namespace heft::host
