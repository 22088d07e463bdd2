// The part of the form for thin layers at walls, made from the description of the port.

const LEFT_OUT_OF_LAYERS = ['spacing'];  // The option "layer spacing" says it, as the flag does.

class LayerFields {
  /** `before`: the layers of the last run; `groups`: names of groups of boundary elements; `spacing`: the field of the option. */
  constructor(schemas, before, groups, spacing) {
    Object.assign(this, {before, spacing});
    const {properties} = schemas['varimesh.v1.Layers'];
    const names = Object.keys(properties).filter((name) => !LEFT_OUT_OF_LAYERS.includes(name));
    this.fields = names.map((name) => new OptionField(name, properties[name], schemas, 'layer'));
    for (const field of this.fields) field.value = before[field.name];
    const known = groups.length ? `The boundary of this mesh has ${groups.join(', ')}.` : 'The boundary of this mesh has no named groups.';
    this.node = make('details', {open: this.isGiven}, make('summary', {}, 'Thin layers at walls'),
        make('p', {class: 'quiet small'}, `Thick cells at the walls are split into thin layers in the end. ${known} Give the walls, and two of layers, first and ` +
            'growth; grow is for walls without thick cells.'),
        make('div', {class: 'options'}, ...this.fields.map((field) => field.node)));
  }

  field(name) {
    return this.fields.find((one) => one.name === name);
  }

  get isGiven() {
    return this.field('walls').value !== undefined;
  }

  /** The part of a JobSpec, undefined without walls. `options`: those of the run, whose spacing becomes that of the layers. */
  spec(options) {
    if (!this.isGiven) return undefined;
    const spacing = options.layerSpacing;
    delete options.layerSpacing;
    return {...Object.fromEntries(this.fields.map((field) => [field.name, field.value]).filter(([, value]) => value !== undefined)), spacing};
  }

  /** The words of the spacing too: it is a flag of its own for the command, and a part of the layers in Python. */
  words() {
    if (!this.isGiven) return this.spacing.words();
    return [...this.spacing.words(), ...this.fields.flatMap((field) => {
      if (field.name === 'walls') return field.value.flatMap((wall) => ['--wall', wall]);
      if (field.name === 'simplices') return field.value ? ['--simplices'] : [];
      return field.words();
    })];
  }

  argument() {
    const spacing = this.spacing.argument();
    if (!this.isGiven) return spacing;
    const [, ...others] = this.fields;
    const own = spacing.map((text) => text.replace('layer_spacing', 'spacing'));
    return [`layers=varimesh.Layers(${[JSON.stringify(this.field('walls').value), ...others.flatMap((field) => field.argument()), ...own].join(', ')})`];
  }
}

/** The names of the groups of boundary elements of a mesh. */
function boundaryGroups(mesh) {
  return mesh.groups.filter(({dimension, name}) => dimension === mesh.dimension - 1 && name).map(({name}) => name);
}
