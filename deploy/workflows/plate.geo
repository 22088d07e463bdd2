// A plate with a hole that is surrounded by thin layers of triangles. The mesh is so coarse that the edges of the hole cut
// through the first layers when they are curved.
SetFactory("OpenCASCADE");
Rectangle(1) = {-4, -4, 0, 8, 8};
// Two arcs, because Gmsh 4.13 makes no layers around a curve that ends where it begins.
Circle(10) = {0, 0, 0, 1, 0, Pi};
Circle(11) = {0, 0, 0, 1, Pi, 2 * Pi};
Curve Loop(2) = {10, 11};
Plane Surface(2) = {2};
BooleanDifference(3) = { Surface{1}; Delete; }{ Surface{2}; Delete; };
hole() = Curve In BoundingBox {-1.1, -1.1, -0.1, 1.1, 1.1, 0.1};
MeshSize{ PointsOf{ Surface{3}; } } = 2.5;
Field[1] = BoundaryLayer;
Field[1].CurvesList = {hole()};
Field[1].Size = 0.04;
Field[1].Ratio = 1.6;
Field[1].Thickness = 0.4;
BoundaryLayer Field = 1;
Transfinite Curve {hole()} = 7;
Physical Surface("plate") = {3};
Physical Curve("hole") = {hole()};
