#pragma once

#include <functional>
#include <future>

namespace tabletop_perception {

/// Work on a thread that does not end with it but waits for other work.
///
/// OpenNI2 remembers the threads that called it, and when another one calls for the first time it
/// asks of each whether it still exists, by pthread_kill: which crashes the process where one has
/// ended. So no thread that calls it may end while the process lives.
class LastingThread {
 public:
  /// Begins the work, which must not throw, on a thread that waits or on a new one.
  explicit LastingThread(std::function<void()> work);

  /// Waits until the work is done.
  ~LastingThread() { done_.wait(); }

  LastingThread(const LastingThread&) = delete;
  LastingThread& operator=(const LastingThread&) = delete;

 private:
  std::future<void> done_;
};

}  // namespace tabletop_perception
