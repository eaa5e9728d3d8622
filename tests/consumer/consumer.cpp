// Morphs a mesh from a program that knows cadmorph by its installed headers alone.
// consumer BASE.step VARIANT.step MESH OUT

#include <cadmorph/cadmorph.h>

#include <cstdio>
#include <exception>

int main(int argc, char** argv) {
  if (argc != 5) return 1;
  try {
    const cadmorph::Mesh mesh = cadmorph::Mesh::read(argv[3]);
    const cadmorph::Morpher morpher(cadmorph::CadModel::from_step(argv[1]), mesh,
                                    {.min_scaled_jacobian = 0.1});
    const cadmorph::MorphResult result = morpher.morph(cadmorph::CadModel::from_step(argv[2]));
    result.write(argv[4]);
    // Matrices of this program go in and stay its own.
    const cadmorph::Mesh copy({.points = mesh.points(),
                               .types = mesh.types(),
                               .offsets = mesh.offsets(),
                               .connectivity = mesh.connectivity()});
    const cadmorph::Points positions = result.positions();
    if (copy.at(positions).points() != positions) return 7;
    std::printf("%lld nodes moved by at most %g mm\n",
                static_cast<long long>(result.positions().rows()),
                result.report().max_displacement_mm);
  } catch (const cadmorph::Error& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return cadmorph::exit_code(error);
  }
  // Errors of the library are caught by their types across its border.
  try {
    cadmorph::CadModel::from_step("missing.step");
  } catch (const cadmorph::IoError& error) {
    return cadmorph::exit_code(error) == 2 ? 0 : 7;
  }
  return 7;
}
