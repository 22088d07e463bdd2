// Describes messages as JSON Schema.
#include "server/http/openapi.h"

#include <google/protobuf/descriptor.h>
#include <google/protobuf/descriptor.pb.h>

#include <nlohmann/json.hpp>
#include <string_view>
#include <utility>

#include "core/base/version.h"
#include "server/http/listen.h"
#include "server/http/routes.h"

namespace varimesh::server {

/// The descriptors of the contract's files, with their comments, embedded by web/embed_files.cmake.
extern const std::string_view contract_bin;

namespace {

namespace pb = google::protobuf;
using Json = nlohmann::ordered_json;

constexpr std::string_view kPackage = "varimesh.v1.";

/// The contract with its comments.
class Contract {
 public:
  Contract() {
    pb::FileDescriptorSet files;
    files.ParseFromArray(contract_bin.data(), static_cast<int>(contract_bin.size()));
    for (const pb::FileDescriptorProto& file : files.file()) pool_.BuildFile(file);
  }

  const pb::Descriptor& message(const std::string& name) const { return *pool_.FindMessageTypeByName(name); }
  const pb::MethodDescriptor& method(const std::string& name) const { return *pool_.FindMethodByName(name); }

 private:
  pb::DescriptorPool pool_;
};

/// The comment before a declaration, or after it.
template <class Descriptor>
std::string comment(const Descriptor& what) {
  pb::SourceLocation place;
  if (!what.GetSourceLocation(&place)) return {};
  std::string text = place.leading_comments.empty() ? place.trailing_comments : place.leading_comments;
  for (auto at = text.find("\n "); at != std::string::npos; at = text.find("\n ", at + 1)) text.erase(at + 1, 1);
  const auto first = text.find_first_not_of(" \n"), last = text.find_last_not_of(" \n");
  return first == std::string::npos ? "" : text.substr(first, last - first + 1);
}

/// Makes schemas of messages and enumerations, and collects those that they refer to.
class Schemas {
 public:
  /// Refers to a message.
  Json message(const pb::Descriptor& type) {
    if (!known_.contains(type.full_name())) {
      known_[type.full_name()] = Json();  // messages may contain each other
      known_[type.full_name()] = describe(type);
    }
    return reference(type.full_name());
  }

  /// A field, with its comment.
  Json field(const pb::FieldDescriptor& field) {
    Json schema;
    if (field.is_map()) {
      schema = {{"type", "object"}, {"additionalProperties", value(*field.message_type()->map_value())}};
    } else if (field.is_repeated()) {
      schema = {{"type", "array"}, {"items", value(field)}};
    } else {
      schema = value(field);
    }
    if (const std::string text = comment(field); !text.empty()) schema["description"] = text;
    return schema;
  }

  const Json& known() const { return known_; }

 private:
  static Json reference(const std::string& name) { return {{"$ref", "#/components/schemas/" + name}}; }

  Json describe(const pb::Descriptor& type) {
    const std::string& name = type.full_name();
    if (name == "google.protobuf.Timestamp") return {{"type", "string"}, {"format", "date-time"}};
    if (name == "google.protobuf.Duration") return {{"type", "string"}, {"pattern", R"(^-?[0-9]+(\.[0-9]+)?s$)"}};
    if (name == "google.protobuf.Any")
      return {{"type", "object"}, {"properties", {{"@type", {{"type", "string"}}}}}, {"required", {"@type"}}};
    Json schema = {{"type", "object"}};
    if (const std::string text = comment(type); !text.empty()) schema["description"] = text;
    Json properties = Json::object();
    for (int i = 0; i < type.field_count(); ++i) properties[type.field(i)->json_name()] = field(*type.field(i));
    schema["properties"] = properties;
    schema["additionalProperties"] = false;
    return schema;
  }

  Json enumeration(const pb::EnumDescriptor& type) {
    Json names = Json::array();
    std::string text = comment(type);
    for (int i = 0; i < type.value_count(); ++i) {
      names.push_back(type.value(i)->name());
      if (const std::string more = comment(*type.value(i)); !more.empty())
        text += (text.empty() ? "" : "\n") + type.value(i)->name() + ": " + more;
    }
    known_[type.full_name()] = {{"type", "string"}, {"enum", names}};
    if (!text.empty()) known_[type.full_name()]["description"] = text;
    return reference(type.full_name());
  }

  /// One value of a field, as proto3 JSON writes it.
  Json value(const pb::FieldDescriptor& field) {
    switch (field.cpp_type()) {
      case pb::FieldDescriptor::CPPTYPE_INT32:
      case pb::FieldDescriptor::CPPTYPE_UINT32:
        return {{"type", "integer"}, {"format", "int32"}};
      case pb::FieldDescriptor::CPPTYPE_INT64:
      case pb::FieldDescriptor::CPPTYPE_UINT64:
        return {{"type", "string"}, {"format", "int64"}, {"pattern", "^-?[0-9]+$"}};
      case pb::FieldDescriptor::CPPTYPE_DOUBLE:
      case pb::FieldDescriptor::CPPTYPE_FLOAT:
        return {{"anyOf", {{{"type", "number"}}, {{"enum", {"NaN", "Infinity", "-Infinity"}}}}}};
      case pb::FieldDescriptor::CPPTYPE_BOOL:
        return {{"type", "boolean"}};
      case pb::FieldDescriptor::CPPTYPE_ENUM:
        return enumeration(*field.enum_type());
      case pb::FieldDescriptor::CPPTYPE_MESSAGE:
        return message(*field.message_type());
      case pb::FieldDescriptor::CPPTYPE_STRING:
        break;
    }
    if (field.type() == pb::FieldDescriptor::TYPE_BYTES) return {{"type", "string"}, {"contentEncoding", "base64"}};
    return {{"type", "string"}};
  }

  Json known_ = Json::object();
};

/// Makes the document.
class Document {
 public:
  std::string text() {
    Json paths = Json::object();
    for (const Route& route : routes()) {
      std::string method(route.method);
      for (char& c : method) c = static_cast<char>(c - 'A' + 'a');
      paths[std::string(route.path)][method] = operation(route);
    }
    const Json document = {
        {"openapi", "3.1.0"},
        {"info",
         {{"title", "VariMesh"},
          {"version", std::string(version())},
          {"description", "Untangles and optimises high-order meshes. Messages are proto3 JSON of the contract."}}},
        {"security", {Json::object(), {{"token", Json::array()}}}},
        {"paths", paths},
        {"components",
         {{"schemas", schemas_.known()}, {"securitySchemes", {{"token", {{"type", "http"}, {"scheme", "bearer"}}}}}}}};
    return document.dump() + "\n";
  }

 private:
  Json operation(const Route& route) {
    const bool is_call = !route.rpc.empty();
    const std::string name = is_call ? std::string(route.rpc) : "GetDocument";
    const bool is_watched = route.to == Route::To::Mesh;  // one of two addresses of the same call
    Json made = {{"operationId", route.method == "PUT" ? name + "ByPut" : is_watched ? name + "OfRunningJob" : name}};
    if (is_watched)
      made["description"] = comment(*message("DownloadMeshRequest").FindFieldByName("job"));
    else if (is_call)
      made["description"] = comment(contract_.method(std::string(route.service) + "." + name));
    else
      made["description"] = "Returns this document.";
    Json parameters = Json::array();
    if (const auto open = route.path.find('{'); open != std::string_view::npos) {
      const std::string id(route.path.substr(open + 1, route.path.find('}') - open - 1));
      parameters.push_back({{"name", id}, {"in", "path"}, {"required", true}, {"schema", {{"type", "string"}}}});
    }
    for (const QueryField& field : route.query) parameters.push_back(parameter(field));
    if (!parameters.empty()) made["parameters"] = parameters;
    if (!route.bodies.empty()) made["requestBody"] = {{"required", true}, {"content", bodies(route)}};
    made["responses"] = {
        {"200", {{"description", "Done."}, {"content", {{std::string(route.answer), answer(route)}}}}},
        {"default", {{"description", "Refused."}, {"content", {{std::string(kJsonType), refusal()}}}}}};
    return made;
  }

  Json parameter(const QueryField& field) {
    const auto& type = contract_.message(std::string(kPackage) + std::string(field.message));
    Json schema = schemas_.field(*type.FindFieldByName(std::string(field.field)));
    std::string name(field.name);
    if (name.ends_with('.')) {  // any text follows
      name += "KEY";
      schema = schema["additionalProperties"];
    }
    Json made = {{"name", name}, {"in", "query"}, {"schema", schema}};
    if (field.is_needed) made["required"] = true;
    return made;
  }

  Json bodies(const Route& route) {
    Json made;
    for (const std::string_view type : route.bodies) {
      Json schema;
      if (type == kJsonType)
        schema = spec();
      else if (type == kFormType)
        schema = {{"type", "object"},
                  {"properties", {{"spec", spec()}, {"mesh", {{"contentMediaType", std::string(kBytesType)}}}}},
                  {"required", {"spec", "mesh"}}};
      made[std::string(type)] = schema.is_null() ? Json::object() : Json{{"schema", schema}};
    }
    return made;
  }

  /// What the answer contains.
  Json answer(const Route& route) {
    if (route.rpc.empty()) return {{"schema", {{"type", "object"}}}};
    if (route.answer == kBytesType) return Json::object();
    if (route.to == Route::To::SendMesh) return {{"schema", schemas_.message(message("StoredMesh"))}};
    if (route.to == Route::To::Events)
      return {{"schema",
               {{"type", "string"},
                {"description", "Server-sent events, whose data are such documents on one line."},
                {"contentSchema", schemas_.message(message("JobEvent"))}}}};
    const auto& rpc = contract_.method(std::string(route.service) + "." + std::string(route.rpc));
    return {{"schema", schemas_.message(*rpc.output_type())}};
  }

  Json refusal() { return {{"schema", schemas_.message(contract_.message("google.rpc.Status"))}}; }
  Json spec() { return schemas_.message(message("JobSpec")); }
  const pb::Descriptor& message(const std::string& name) const {
    return contract_.message(std::string(kPackage) + name);
  }

  const Contract contract_;
  Schemas schemas_;
};

}  // namespace

const std::string& openapi_document() {
  static const std::string text = Document().text();
  return text;
}

}  // namespace varimesh::server
