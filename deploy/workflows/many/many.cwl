#!/usr/bin/env cwl-runner
# Optimises many meshes: cwltool --parallel --no-container many.cwl --server HOST:PORT --meshes a.msh --meshes b.msh
cwlVersion: v1.2
class: Workflow
label: Optimise many high-order meshes
requirements:
  ScatterFeatureRequirement: {}
  StepInputExpressionRequirement: {}
  InlineJavascriptRequirement: {}
inputs:
  meshes:
    type: File[]
  server:
    type: string?
    doc: HOST:PORT or unix:PATH; without it this machine does the work
  energy:
    type: string?
steps:
  optimise:
    run: ../optimise.cwl
    scatter: mesh
    in:
      mesh: meshes
      server: server
      energy: energy
      name: {valueFrom: $(inputs.mesh.nameroot)}
    out: [msh, quality]
outputs:
  results: {type: "File[]", outputSource: optimise/msh}
  qualities: {type: "File[]", outputSource: optimise/quality}
