#include "lasting_thread.h"

#include <condition_variable>
#include <deque>
#include <memory>
#include <mutex>
#include <thread>
#include <utility>

namespace tabletop_perception {
namespace {

/// All lasting threads of the process.
class Threads {
 public:
  std::future<void> begin(std::function<void()> work) {
    const auto done = std::make_shared<std::promise<void>>();
    std::lock_guard<std::mutex> lock(mutex_);
    tasks_.push_back([this, work = std::move(work), done] {
      work();
      std::unique_lock<std::mutex> counted(mutex_);
      ++waiting_;  // before anybody learns of it: who begins anew then finds this thread
      counted.unlock();
      done->set_value();
    });
    if (waiting_ > 0) {
      --waiting_;
      wake_.notify_one();
    } else {
      std::thread([this] { serve(); }).detach();
    }
    return done->get_future();
  }

 private:
  [[noreturn]] void serve() {
    std::unique_lock<std::mutex> lock(mutex_);
    while (true) {
      wake_.wait(lock, [this] { return !tasks_.empty(); });
      const auto task = std::move(tasks_.front());
      tasks_.pop_front();
      lock.unlock();
      task();
      lock.lock();
    }
  }

  std::mutex mutex_;
  std::condition_variable wake_;
  std::deque<std::function<void()>> tasks_;
  int waiting_ = 0;  ///< threads that nothing was given to
};

Threads& threads() {
  static auto& all = *new Threads;  // never destroyed, as its threads never end
  return all;
}

}  // namespace

LastingThread::LastingThread(std::function<void()> work)
    : done_(threads().begin(std::move(work))) {}

}  // namespace tabletop_perception
