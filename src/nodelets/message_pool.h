#pragma once

#include <memory>
#include <mutex>
#include <utility>

#include <boost/shared_ptr.hpp>

namespace tabletop_perception {

/// Makes messages for roscpp to read into, out of those that everybody has let go of: they have
/// their memory already, which a new one would have to clear first. From any thread.
template <typename Message>
class MessagePool {
 public:
  boost::shared_ptr<Message> operator()() const {
    auto message = idle_->take();
    auto* const raw = message.get();
    return boost::shared_ptr<Message>(raw, [idle = idle_, owner = std::move(message)](
                                               Message*) mutable { idle->give(std::move(owner)); });
  }

 private:
  class Idle {
   public:
    std::shared_ptr<Message> take() {
      const std::lock_guard<std::mutex> lock(mutex_);
      if (!message_) return std::make_shared<Message>();
      return std::move(message_);
    }
    void give(std::shared_ptr<Message> message) {
      const std::lock_guard<std::mutex> lock(mutex_);
      message_ = std::move(message);
    }

   private:
    std::mutex mutex_;
    std::shared_ptr<Message> message_;  // one: the frame before is mostly done when the next comes
  };

  std::shared_ptr<Idle> idle_ = std::make_shared<Idle>();
};

}  // namespace tabletop_perception
