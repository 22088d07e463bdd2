// Optimises a mesh with the installed library: untangle IN OUT. docs/api.md shows the same code.
#include <varimesh/varimesh.h>

#include <cstdio>

int main(int, char** arguments) {
  auto file = varimesh::formats::read_file(arguments[1]);
  if (!file) return std::puts(file.error().sentence.c_str()), 3;

  varimesh::Options options;
  options.min_js = 0.2;
  auto result = varimesh::optimise(std::move(file->mesh), options);
  if (!result) return std::puts(result.error().sentence.c_str()), 1;

  std::printf("invalid elements: %d before, %d after; smallest scaled Jacobian %.3f\n",
              int(result->before.invalid_elements), int(result->after.invalid_elements),
              result->after.min_scaled_jacobian);
  auto written = varimesh::formats::write_file(result->mesh, file->format, arguments[2]);
  if (!written) return std::puts(written.error().sentence.c_str()), 3;
  return result->after.invalid_elements == 0 ? 0 : 4;
}
