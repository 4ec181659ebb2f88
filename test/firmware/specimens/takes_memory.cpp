// Must not link into an image: there is no heap.
#include <cstdlib>

int firmware_main() {
  void* volatile block = std::malloc(64);
  return block == nullptr ? 1 : 0;
}
