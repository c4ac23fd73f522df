#include "tabletop_perception/frame_memory.h"

#include <cstdlib>  // __GLIBC__, where it is

#ifdef __GLIBC__
#include <malloc.h>
#endif

namespace tabletop_perception {

void keepFrameMemory() {
#ifdef __GLIBC__
  constexpr int MB = 1 << 20;
  mallopt(M_TRIM_THRESHOLD, 256 * MB);
  mallopt(M_MMAP_THRESHOLD, 32 * MB);  // the largest value that glibc takes
#endif
}

}  // namespace tabletop_perception
