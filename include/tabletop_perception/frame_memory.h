#pragma once

namespace tabletop_perception {

/// Lets this process keep what a frame frees for the next one. Clouds are so large that glibc
/// otherwise gives their memory back to the system at the end of every frame, and the system clears
/// it again for the next one, page by page. At most 256 MB are kept. No effect with another
/// C library.
void keepFrameMemory();

}  // namespace tabletop_perception
