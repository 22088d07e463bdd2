// LISTEN, and what follows.
#include "server/postgres/listener.h"

#include <string_view>

#include "server/postgres/connection.h"
#include "server/postgres/postgres_jobs.h"

namespace varimesh::server {
namespace {

/// How often the thread looks whether it is to end.
constexpr std::chrono::milliseconds kLook{200};

News news_of(const std::string& text) {
  const std::string_view cancel = kCancelNews, changed = kChangedNews;
  if (text.starts_with(cancel)) return {News::Kind::Cancel, text.substr(cancel.size())};
  if (text.starts_with(changed)) return {News::Kind::Changed, text.substr(changed.size())};
  return {News::Kind::Queue, {}};
}

}  // namespace

PostgresListener::PostgresListener(std::string url, std::function<void(const News&)> listener)
    : url_(std::move(url)), listener_(std::move(listener)), thread_([this] { run(); }) {}

PostgresListener::~PostgresListener() {
  stopping_ = true;
  thread_.join();
}

void PostgresListener::run() {
  while (!stopping_) {
    try {
      hear();
    } catch (const PostgresError&) {
      // The pool of the store says in the log that the database is away.
      for (int i = 0; i < 5 && !stopping_; ++i) std::this_thread::sleep_for(kLook);
    }
  }
}

void PostgresListener::hear() {
  PostgresConnection connection(url_);
  connection.run("LISTEN varimesh");
  listener_({News::Kind::Reconnected, {}});
  while (!stopping_)
    for (const std::string& text : connection.wait_for_news(kLook)) listener_(news_of(text));
}

}  // namespace varimesh::server
