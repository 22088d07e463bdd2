{{/* What the pods of all servers have in common. */}}

{{- define "varimesh.pod" -}}
serviceAccountName: varimesh
automountServiceAccountToken: false
securityContext:
  {runAsNonRoot: true, runAsUser: 65532, runAsGroup: 65532, fsGroup: 65532, fsGroupChangePolicy: OnRootMismatch, seccompProfile: {type: RuntimeDefault}}
{{- end }}

{{- define "varimesh.image" -}}
{{- with .Values.image }}
image: "{{ .repository }}{{ if .digest }}@{{ .digest }}{{ else }}:{{ .tag }}{{ end }}"
{{- end }}
{{- end }}

{{/* libpq reads the password from a file, if only its user can read that. In the environment it would lie open as long as the
     server runs. */}}
{{- define "varimesh.password" -}}
- name: password
  {{- include "varimesh.image" . | nindent 2 }}
  command:
    - sh
    - -c
    - umask 077; sed 's/[:\\]/\\&/g; s/^/*:*:*:*:/' /database/password > /password/pgpass
  resources: {requests: {cpu: 10m, memory: 16Mi}, limits: {memory: 64Mi}}
  securityContext: {allowPrivilegeEscalation: false, readOnlyRootFilesystem: true, capabilities: {drop: [ALL]}}
  volumeMounts: [{name: database, mountPath: /database, readOnly: true}, {name: password, mountPath: /password}]
{{- end }}

{{- define "varimesh.password.volumes" -}}
- {name: database, secret: {secretName: {{ .Values.database.secret }}, items: [{key: password, path: password}], defaultMode: 0440}}
- {name: password, emptyDir: {medium: Memory, sizeLimit: 1Mi}}
{{- end }}

{{- define "varimesh.container" -}}
name: varimeshd
{{- include "varimesh.image" . }}
envFrom: [{configMapRef: {name: varimesh}}]
env:
  - {name: PGPASSFILE, value: /password/pgpass}
{{- if .Values.meshes.bucket }}
  - {name: AWS_SHARED_CREDENTIALS_FILE, value: /bucket/credentials}
{{- end }}
securityContext: {allowPrivilegeEscalation: false, readOnlyRootFilesystem: true, capabilities: {drop: [ALL]}}
{{- end }}

{{- define "varimesh.probes" -}}
startupProbe: {httpGet: {path: /healthz/live, port: metrics}, periodSeconds: 1, failureThreshold: 60}
readinessProbe: {httpGet: {path: /healthz/ready, port: metrics}, periodSeconds: 5}
livenessProbe: {httpGet: {path: /healthz/live, port: metrics}, periodSeconds: 10, timeoutSeconds: 5}
{{- end }}

{{- define "varimesh.mounts" -}}
{{- if .Values.meshes.bucket }}
- {name: bucket, mountPath: /bucket, readOnly: true}
{{- else }}
- {name: meshes, mountPath: /volume}
{{- end }}
- {name: tmp, mountPath: /tmp}
- {name: password, mountPath: /password, readOnly: true}
{{- end }}

{{- define "varimesh.volumes" -}}
{{- if .Values.meshes.bucket }}
- {name: bucket, secret: {secretName: {{ .Values.meshes.secret }}, defaultMode: 0440}}
{{- else }}
- {name: meshes, persistentVolumeClaim: {claimName: varimesh-meshes}}
{{- end }}
- {name: tmp, emptyDir: {}}
{{ include "varimesh.password.volumes" . }}
{{- end }}
