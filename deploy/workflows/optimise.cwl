#!/usr/bin/env cwl-runner
# One step of a CWL workflow: cwltool --no-container optimise.cwl --mesh in.msh --server HOST:PORT
cwlVersion: v1.2
class: CommandLineTool
label: Optimise a high-order mesh
baseCommand: [varimesh, optimise]
requirements:
  NetworkAccess:
    networkAccess: true
inputs:
  mesh:
    type: File
    inputBinding: {position: 1}
  server:
    type: string?
    doc: HOST:PORT or unix:PATH; without it the command does the work itself
    inputBinding: {prefix: --server}
  request_id:
    type: string?
    doc: A repetition with the same id joins the same job
    inputBinding: {prefix: --request-id}
  energy:
    type: string?
    doc: Without it the objective is accuracy, the default; an energy is an objective of its own
    inputBinding: {prefix: --energy}
  name:
    type: string
    default: optimised
arguments:
  - {prefix: --output, valueFrom: $(inputs.name).msh}
  - {prefix: --output, valueFrom: $(inputs.name).vtu}
  - --json
# Status 4 means that the files are written, but some elements are not certified valid; the output `quality` says how many.
# If you can use such a mesh, move 4 to successCodes.
successCodes: [0]
temporaryFailCodes: [5]
permanentFailCodes: [1, 2, 3, 4, 6]
stdout: $(inputs.name).json
outputs:
  msh: {type: File, outputBinding: {glob: $(inputs.name).msh}}
  vtu: {type: File, outputBinding: {glob: $(inputs.name).vtu}}
  quality: {type: stdout}
