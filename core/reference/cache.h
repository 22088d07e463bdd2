// Results that are made once per key, may be asked for from any thread, and stay where they are for ever.
#pragma once

#include <map>
#include <mutex>
#include <utility>

namespace varimesh::reference {

/// Keeps one value a key. Values are made outside the lock, since making one may ask the same cache for another; if two
/// threads make the same value, the first is kept. References stay valid as long as the cache, because a map never
/// moves its entries.
template <class Key, class Value>
class Cache {
 public:
  /// The value for `key`, made by `make()` if it is not there yet.
  template <class Make>
  const Value& get(const Key& key, Make make) {
    {
      const std::lock_guard lock(mutex_);
      if (const auto found = values_.find(key); found != values_.end()) return found->second;
    }
    Value value = make();
    const std::lock_guard lock(mutex_);
    return values_.try_emplace(key, std::move(value)).first->second;
  }

 private:
  std::mutex mutex_;
  std::map<Key, Value> values_;
};

}  // namespace varimesh::reference
