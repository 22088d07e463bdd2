"""The description of --http (/v1/openapi.json): it has every address and every field of the contract, and the answers of the
server are as it says. ctest runs it with VARIMESH, VARIMESHD and VARIMESH_SOURCE_DIR in the environment, and with the Python
package of the build tree."""
import os
import re
import sys
import unittest
from pathlib import Path

from over_http import WithHttp
from programs import ENDLESS, LARGER, MESH

try:
    import jsonschema
    from google.protobuf.descriptor import FieldDescriptor
    from varimesh.v1 import job_pb2, optimise_pb2, quality_pb2, service_pb2
except ModuleNotFoundError as missing:
    print(f"SKIPPED: {missing} (deploy/setup test)", flush=True)
    sys.exit(77)

TYPES = {FieldDescriptor.CPPTYPE_INT32: "integer", FieldDescriptor.CPPTYPE_UINT32: "integer", FieldDescriptor.CPPTYPE_INT64: "string",
         FieldDescriptor.CPPTYPE_UINT64: "string", FieldDescriptor.CPPTYPE_BOOL: "boolean", FieldDescriptor.CPPTYPE_STRING: "string"}


class Document(WithHttp):
    def setUp(self):
        super().setUp()
        code, self.document = self.ask("GET", "/v1/openapi.json")
        self.assertEqual(code, 200)
        self.schemas = self.document["components"]["schemas"]

    def validate(self, schema, instance):
        jsonschema.Draft202012Validator({**schema, "components": self.document["components"]}).validate(instance)

    def answer(self, method, path):
        return self.document["paths"][path][method]["responses"]["200"]["content"]["application/json"]["schema"]

    def test_has_every_address_of_the_page(self):
        page = (Path(os.environ["VARIMESH_SOURCE_DIR"]) / "docs" / "http.md").read_text()
        told = set()
        for method, path in re.findall(r"^\| `([A-Z]+) (/v1/[^`? ]+)", page, re.M):
            path = path.replace("/jobs/ID", "/jobs/{job}").replace("/uploads/ID", "/uploads/{upload}")
            told.add((method.lower(), path))
        told.add(("put", "/v1/meshes"))
        found = {(method, path) for path, methods in self.document["paths"].items() for method in methods}
        self.assertEqual(found, told)
        ids = [operation["operationId"] for methods in self.document["paths"].values() for operation in methods.values()]
        self.assertEqual(len(ids), len(set(ids)))

    def test_every_address_is_there_and_no_other(self):
        unknown = self.ask("GET", "/v1/nothing")[1]["message"]
        for path, methods in self.document["paths"].items():
            real = path.replace("{job}", "0" * 32).replace("{upload}", "one")
            for method in ("get", "post", "put", "delete", "patch"):
                code, told = self.ask(method.upper(), real, "{}" if method in ("post", "put") else None)
                self.assertEqual(code != 405, method in methods, (method, path, told))
                self.assertNotEqual(told.get("message"), unknown)
                if code == 405:
                    self.assertEqual(re.search("takes (.*) only", told["message"])[1].lower().split(", "), sorted(methods, key=list(methods).index))
                if code != 200:
                    self.validate(methods.get(method, methods[list(methods)[0]])["responses"]["default"]["content"]["application/json"]["schema"], told)

    def check_message(self, descriptor, seen):
        if descriptor.full_name in seen:
            return
        seen.add(descriptor.full_name)
        if descriptor.full_name.startswith("google.protobuf."):
            self.assertEqual(self.schemas[descriptor.full_name]["type"], "string")
            return
        schema = self.schemas[descriptor.full_name]
        self.assertEqual(set(schema["properties"]), {field.json_name for field in descriptor.fields}, descriptor.full_name)
        self.assertIs(schema["additionalProperties"], False)
        for field in descriptor.fields:
            told = schema["properties"][field.json_name]
            of_map = field.message_type is not None and field.message_type.GetOptions().map_entry
            if of_map:
                self.assertEqual(told["type"], "object")
                told, field = told["additionalProperties"], field.message_type.fields_by_name["value"]
            elif field.label == FieldDescriptor.LABEL_REPEATED:
                self.assertEqual(told["type"], "array")
                told = told["items"]
            if field.enum_type is not None:
                self.assertEqual(told["$ref"], "#/components/schemas/" + field.enum_type.full_name)
                self.assertEqual(self.schemas[field.enum_type.full_name]["enum"], [value.name for value in field.enum_type.values])
            elif field.message_type is not None:
                self.assertEqual(told["$ref"], "#/components/schemas/" + field.message_type.full_name)
                self.check_message(field.message_type, seen)
            elif field.cpp_type in (FieldDescriptor.CPPTYPE_DOUBLE, FieldDescriptor.CPPTYPE_FLOAT):
                self.assertEqual(told["anyOf"][0], {"type": "number"})
            else:
                self.assertEqual(told["type"], TYPES[field.cpp_type], field.full_name)

    def test_has_every_field_of_the_contract(self):
        seen = set()
        for message in (job_pb2.JobSpec, job_pb2.Job, job_pb2.JobEvent, optimise_pb2.Metrics, service_pb2.GetServerInfoResponse,
                        service_pb2.ListJobsResponse, service_pb2.QueryUploadResponse):
            self.check_message(message.DESCRIPTOR, seen)
        self.assertGreater(len(seen), 25)
        self.assertEqual({name for name in self.schemas if name.startswith("varimesh.") and "properties" in self.schemas[name]} - seen,
                         {"varimesh.v1." + name + "Response" for name in ("SubmitJob", "GetJob", "CancelJob", "DeleteJob")})

    def test_the_page_has_words_for_every_remedy(self):
        facts = (Path(os.environ["VARIMESH_SOURCE_DIR"]) / "server" / "http" / "page" / "facts.js").read_text()
        table = re.search(r"REMEDY_ACTIONS = \{(.*?)\n\};", facts, re.DOTALL).group(1)
        kinds = {name.removeprefix("KIND_") for name, number in quality_pb2.Remedy.Kind.items() if number != 0}
        self.assertEqual(set(re.findall(r"^  ([A-Z_]+): ", table, re.MULTILINE)), kinds)

    def test_has_the_comments_of_the_contract(self):
        self.assertIn("-100 to 100", self.schemas["varimesh.v1.JobSpec"]["properties"]["priority"]["description"])
        self.assertIn("Puts a job in the queue", self.document["paths"]["/v1/jobs"]["post"]["description"])
        self.assertIn("JOB_STATE_PENDING: The job waits", self.schemas["varimesh.v1.JobState"]["description"])

    def test_answers_are_as_it_says(self):
        self.validate(self.answer("get", "/v1/info"), self.ask("GET", "/v1/info")[1])
        done = self.wait(self.submit(MESH), "JOB_STATE_SUCCEEDED")
        running = self.submit(LARGER, *ENDLESS)
        self.wait(running, "JOB_STATE_RUNNING")
        for schema, (code, told) in (
                (self.answer("get", "/v1/jobs/{job}"), self.ask("GET", "/v1/" + done["name"])),
                (self.answer("get", "/v1/jobs/{job}"), self.ask("GET", "/v1/jobs/" + running)),
                (self.answer("get", "/v1/jobs"), self.ask("GET", "/v1/jobs")),
                (self.answer("post", "/v1/jobs"), self.ask("POST", "/v1/jobs", done["spec"])),
                (self.answer("post", "/v1/jobs/{job}/cancel"), self.ask("POST", f"/v1/jobs/{running}/cancel")),
                (self.answer("delete", "/v1/jobs/{job}"), self.ask("DELETE", "/v1/" + done["name"]))):
            self.assertEqual(code, 200, told)
            self.validate(schema, told)
        self.validate({"$ref": "#/components/schemas/varimesh.v1.JobSpec"}, done["spec"])
        for wrong in ({"name": 5}, {"job": {"state": "DONE"}}, {"job": {"nothing": 1}}):
            with self.assertRaises(jsonschema.ValidationError):
                self.validate(self.answer("get", "/v1/jobs/{job}"), wrong)


if __name__ == "__main__":
    unittest.main(verbosity=2)
