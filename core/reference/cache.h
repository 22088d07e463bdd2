// A cache for results that are computed once per key. Any thread may use it, and its entries never move.
#pragma once

#include <map>
#include <mutex>
#include <utility>

namespace varimesh::reference {

/// Keeps one value per key. A value is made outside the lock, because making it may need another value of the same
/// cache. If two threads make the same value, the first is kept. References stay valid as long as the cache, because a
/// map never moves its entries.
template <class Key, class Value>
class Cache {
 public:
  /// The value for `key`. make() makes it if the cache does not have it yet.
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
