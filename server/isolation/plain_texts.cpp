#include "server/isolation/plain_texts.h"

#include <algorithm>
#include <string>
#include <vector>

#include "core/base/utf8.h"

namespace varimesh::server {

using google::protobuf::FieldDescriptor;
using google::protobuf::Message;
using google::protobuf::Reflection;

void make_plain(Message& message) {
  const Reflection& reflection = *message.GetReflection();
  std::vector<const FieldDescriptor*> fields;
  reflection.ListFields(message, &fields);
  for (const FieldDescriptor* field : fields) {
    const bool is_text = field->cpp_type() == FieldDescriptor::CPPTYPE_STRING;
    if (!is_text && field->cpp_type() != FieldDescriptor::CPPTYPE_MESSAGE) continue;
    if (field->is_repeated()) {
      for (int i = 0; i < reflection.FieldSize(message, field); ++i)
        if (is_text)
          reflection.SetRepeatedString(&message, field, i,
                                       as_plain_text(reflection.GetRepeatedString(message, field, i)));
        else
          make_plain(*reflection.MutableRepeatedMessage(&message, field, i));
    } else if (is_text) {
      reflection.SetString(&message, field, as_plain_text(reflection.GetString(message, field)));
    } else {
      make_plain(*reflection.MutableMessage(&message, field));
    }
  }
}

Error plain_error(const worker::Failure& failure) {
  const int most = static_cast<int>(Error::Kind::Internal);
  return {static_cast<Error::Kind>(std::clamp(failure.kind(), 0, most)), as_plain_text(failure.sentence())};
}

}  // namespace varimesh::server
